"""The fleet in a browser: one web page that shows the robots, stops them, and on request drives them.

| Module | What it does |
|---|---|
| access | decides by token, Host and Origin who may see the page |
| connection_limits | keeps room for those that are logged in |
| feed, robot_feed | keep the fleet as it is now, from topics |
| sections | splits it into numbered pieces of JSON, so that a page gets what is new to it |
| requests | checks what a page sends |
| dead_man | drives a robot only while its button is held |
| commander | publishes stops, velocities and goals |
| log_thread | logs without waiting for the terminal |
| server | speaks HTTP and WebSocket (tornado) |
| program | reads parameters and wires all of these to one node |
| web/ | what people see |
"""
