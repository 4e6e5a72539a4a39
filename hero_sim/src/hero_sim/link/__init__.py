"""The way from the robots to the driver: TCP connections, and the Wi-Fi in front of them."""
