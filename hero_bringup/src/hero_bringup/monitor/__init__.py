"""The fleet in a browser: what ROS says of the robots -> one web page, and back to a few commands.

| Module | Turns | Into |
|---|---|---|
| access | tokens, cookies, Host and Origin headers | yes or no |
| feed, robot_feed | topics | the fleet as it is now |
| sections | the fleet as it is now | numbered pieces of JSON, so that a page gets what is new to it |
| requests | what a page sends | checked requests |
| dead_man | held and released buttons, the time | velocities, and stops |
| commander | requests | topics and the driver's stop service |
| server | pieces of JSON, requests | HTTP and WebSocket (tornado) |
| program | parameters | all of these, as one node |
| web/ | pieces of JSON | what people see |
"""
