"""Token buckets let through a burst, then their rate; those of many names stay few."""

from hero_node.token_bucket import BUCKETS_MAX, TokenBucket, TokenBuckets


def test_a_bucket_gives_its_burst_and_then_its_rate():
    bucket = TokenBucket(3.0, 2.0, 0.0)
    assert [bucket.take(1.0, 0.0) for _ in range(4)] == [True, True, True, False]
    assert not bucket.take(1.0, 0.4)
    assert bucket.take(1.0, 0.5) and not bucket.take(1.0, 0.5)
    assert bucket.count(100.0) == 3.0
    assert bucket.take(1.0, 100.0) and bucket.count(100.0) == 2.0, "what is beyond the burst is lost"
    assert bucket.count(100.25) == 2.5


def test_names_have_a_bucket_each():
    buckets = TokenBuckets(1.0, 1.0)
    assert buckets.take("a", 1.0, 0.0) and not buckets.take("a", 1.0, 0.0)
    assert buckets.count("a", 0.5) == 0.5 and buckets.count("b", 0.5) == 1.0
    assert buckets.take("b", 1.0, 0.5)


def test_the_oldest_of_too_many_buckets_is_forgotten():
    buckets = TokenBuckets(2.0, 1.0)
    for number in range(BUCKETS_MAX + 1):
        assert buckets.take(str(number), 2.0, 0.0)
    assert buckets.count("0", 0.0) == 2.0, "forgotten"
    assert buckets.count("1", 0.0) == 0.0 and buckets.count(str(BUCKETS_MAX), 0.0) == 0.0


def test_buckets_that_are_full_again_are_forgotten_before_others():
    buckets = TokenBuckets(2.0, 1.0)
    assert buckets.take("empty", 2.0, 0.0)
    for number in range(1, BUCKETS_MAX):
        assert buckets.take(str(number), 0.5, 0.0)
    assert buckets.take("new", 1.0, 1.0)
    assert buckets.count("empty", 1.0) == 1.0, "it was forgotten though it was not full"
