"""HTTP and WebSocket, and who may use them; no ROS."""
