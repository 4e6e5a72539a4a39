"""std_msgs/String and md5s for declarations of topics and services that stock robots do not have."""

from std_msgs.msg import String

from hero_test import stock_messages

STRING_MD5 = String._md5sum
WRONG_MD5 = "0123456789abcdef0123456789abcdef"


def make_text(text):
    """Return the payload of a std_msgs/String."""
    return stock_messages.to_bytes(String(text))
