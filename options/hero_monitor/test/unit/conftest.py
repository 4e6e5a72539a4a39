"""Offers pages the behaviors of hero_swarm, which the monitor finds at its start; so each test file can run alone."""

from hero_monitor.control.offers import OFFERS, read_behaviors
from hero_swarm.describe import describe_behaviors

OFFERS.update(read_behaviors(describe_behaviors()))
