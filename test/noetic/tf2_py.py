"""In place of tf2_py, whose compiled part runs only on the Python of the system: its names, without transforms."""


class TransformException(Exception):  # noqa: N818 - the name in tf2_py
    pass


class ConnectivityException(TransformException):
    pass


class ExtrapolationException(TransformException):
    pass


class InvalidArgumentException(TransformException):
    pass


class LookupException(TransformException):
    pass


class TimeoutException(TransformException):
    pass


class BufferCore:
    pass
