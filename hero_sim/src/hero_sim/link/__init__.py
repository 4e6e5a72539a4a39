"""The link between robots and driver: TCP connections behind simulated Wi-Fi."""
