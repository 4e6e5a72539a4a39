"""Messages of hero_msgs that the stock package has, too."""

from hero_msgs.msg import Encoder, Motor

__all__ = ["Encoder", "Motor"]
