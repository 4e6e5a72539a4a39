"""States of robots in drivers' reports (hero_msgs/Robot), as tables show them. Pure; a test compares the numbers."""

STATES = {0: "JOINING", 1: "READY", 2: "AWAY", 3: "REFUSED"}
STOP_STATES = {0: "", 1: "stopping", 2: "at rest", 3: "MOVING", 4: "unconfirmed"}
