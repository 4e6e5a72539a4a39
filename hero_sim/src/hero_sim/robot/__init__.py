"""One robot by the rules of the stock firmware: bytes and time in, bytes and servo pulses out."""

from .firmware import SPIN_MS
