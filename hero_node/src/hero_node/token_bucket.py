"""Token buckets, which limit how often something may happen. Pure."""

from typing import Dict

BUCKETS_MAX = 1000
"""Names whose buckets are remembered."""


class TokenBucket:
    """Tokens for something limited; times are of any clock that never steps back."""

    def __init__(self, burst: float, per_s: float, now_s: float) -> None:
        """Begin full: burst tokens may be taken at once, and per_s more in each second after that."""
        self.burst = burst
        self._per_s = per_s
        self._tokens = burst
        self._filled_s = now_s

    def take(self, tokens: float, now_s: float) -> bool:
        """Take tokens; return False, and take none, if there are not enough."""
        left = self._tokens + self._per_s * (now_s - self._filled_s) - tokens
        if left > self.burst - tokens:  # min() in count() would cost more than all else here
            left = self.burst - tokens
        if left < 0.0:
            return False
        self._tokens, self._filled_s = left, now_s
        return True

    def count(self, now_s: float) -> float:
        """Return how many tokens there are."""
        return min(self.burst, self._tokens + self._per_s * (now_s - self._filled_s))


class TokenBuckets:
    """One token bucket for each of many names; of more than BUCKETS_MAX, full or else the oldest ones are forgotten."""

    def __init__(self, burst: float, per_s: float) -> None:
        """burst, per_s: as of each TokenBucket."""
        self._burst = burst
        self._per_s = per_s
        self._buckets: Dict[str, TokenBucket] = {}

    def take(self, name: str, tokens: float, now_s: float) -> bool:
        """Take tokens from the bucket of name; return False, and take none, if there are not enough."""
        bucket = self._buckets.get(name)
        if bucket is None:
            if len(self._buckets) >= BUCKETS_MAX:
                self._buckets = {key: kept for key, kept in self._buckets.items() if kept.count(now_s) < self._burst}
            if len(self._buckets) >= BUCKETS_MAX:
                del self._buckets[next(iter(self._buckets))]  # the oldest
            bucket = self._buckets[name] = TokenBucket(self._burst, self._per_s, now_s)
        return bucket.take(tokens, now_s)

    def count(self, name: str, now_s: float) -> float:
        """Return how many tokens the bucket of name holds."""
        bucket = self._buckets.get(name)
        return self._burst if bucket is None else bucket.count(now_s)
