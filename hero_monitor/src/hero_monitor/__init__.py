"""The fleet on a web page that shows the robots, stops them, and on request drives them.

| Module | Purpose |
|---|---|
| access | decides by token, Host and Origin who may see the page |
| connection_limits | limits the connections and token attempts of untrusted clients |
| feed, robot_feed, camera_picture, placement | read topics |
| sections | encodes the fleet as numbered sections of JSON, of which a page gets those that are new to it |
| requests | parses what a page sends |
| freshness | tells requests made now from those that a socket held |
| losses | names what pages cannot know at present, with cause and remedy |
| master_link | asks whether the ROS master answers |
| dead_man | drives a robot only while its button is held |
| commander | publishes stops, velocities and goals |
| background | runs what may block on other threads |
| server | HTTP and WebSocket (tornado) |
| parameters | reads and checks the node's parameters |
| program | wires everything |
| web/ | the page |
"""
