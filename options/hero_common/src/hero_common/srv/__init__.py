"""Services of hero_msgs: those that the stock package has."""

from hero_msgs.srv import *  # noqa: F403 - with a class for each request and each response
