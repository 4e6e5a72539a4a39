"""The fleet on a web page that shows the robots, stops them, and on request drives them.

| Room | Purpose |
|---|---|
| serving/ | HTTP and WebSocket (tornado), and who may use them: access, client_limits, server; no ROS |
| fleet_feed/ | ROS topics into the state that pages show, of which each page gets what is new to it (page_state) |
| control/ | requests of pages, and what they make robots do: stops, velocities while a button is held, goals |
| background | runs what may block on other threads |
| parameters | reads and checks the node's parameters |
| program | wires everything |
| web/ | the page: main.js wires connection, panels/ and map/ |
"""
