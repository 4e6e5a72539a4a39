"""Reads log lines of robots (versions, uptime, self-tuning) and relays them to /rosout. On the event loop's thread."""

import math

from ..fleet import log_lines
from ..fleet.registry import RobotRecord
from ..peer import Peer
from ..ros.log_relay import LogRelay
from ..rosserial.payloads import LOG_DEBUG, LOG_ERROR, LOG_FATAL, LOG_INFO, LOG_WARN, Log

LEVELS = {LOG_DEBUG: "debug", LOG_INFO: "info", LOG_WARN: "warn", LOG_ERROR: "error", LOG_FATAL: "fatal"}


def receive_line(relay: LogRelay, peer: Peer, log: Log, now_s: float) -> None:
    """Take a line of a robot: note what it tells, and pass it on to relay."""
    line = log_lines.read_log_line(log.text)
    if line.boot is not None:
        peer.boot = line.boot
    if peer.bridge is None or peer.record is None:
        peer.keep(log)
        return
    record = peer.record
    if line.boot is not None:
        record.firmware, record.hardware, record.config = line.boot
        if record.heard_uptime_s > 0.0:
            record.heard_uptime_s = math.inf
    if line.world and line.world != record.world:
        record.world = line.world
        peer.bridge.corrections.odometry.start_at_zero()
    if line.tunes is not None:
        peer.bridge.commands.note_tuning(line.tunes)
        if line.tunes and not peer.bridge.commands.was_told_to_tune and peer.stop is None:
            _receive_unrequested_tuning(relay, peer)
    if line.uptime_s is not None:
        _receive_uptime(relay, peer, record, line.uptime_s, now_s)
    if not peer.log_lines.take(1.0, now_s):
        record.dropped_messages += 1
        return
    level = "debug" if line.is_routine else LEVELS.get(log.level, "error")
    relay.log(level, f"{peer.label}: {line.text}")


def _receive_unrequested_tuning(relay: LogRelay, peer: Peer) -> None:
    if peer.wheels.is_late:
        # The line may be from before the tuning was ended. While it goes on 47 more follow each second.
        peer.owner.warn_late()
        return
    # Left by an earlier driver or connection: nothing else would end it.
    relay.log("warn", f"{peer.label} tunes itself, without a request from this driver: stopped")
    peer.owner.stop_robot(peer)


def _receive_uptime(relay: LogRelay, peer: Peer, record: RobotRecord, uptime_s: float, now_s: float) -> None:
    # By its own clock: a line may be late by any time, as after a stall of the network or a pause of the driver.
    has_rebooted = uptime_s < record.heard_uptime_s
    record.heard_uptime_s = uptime_s
    if has_rebooted:
        text = f"{peer.label} rebooted {uptime_s:.1f} s ago"
        relay.log_throttled("warn", "rebooted " + peer.label, text)
        if peer.bridge is not None and peer.boot is None:
            peer.bridge.corrections.odometry.note_reboot()
    # Delays only make a boot look later, so the earliest is the best.
    booted_s = now_s - uptime_s
    if has_rebooted or record.booted_s is None or booted_s < record.booted_s:
        record.booted_s = booted_s
