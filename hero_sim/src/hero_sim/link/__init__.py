"""The link between robots and driver: TCP connections behind simulated Wi-Fi."""

from .wifi import Radio, build_network, parse_wifi
