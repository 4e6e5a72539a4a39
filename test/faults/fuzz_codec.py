"""Coverage-guided fuzzing of codec, session and corrections, with atheris; options as libFuzzer's.

fuzz_codec.py [-max_total_time=60] [CORPUS_DIR]
"""

import sys

import atheris

with atheris.instrument_imports():
    from hero_driver.corrections import message_layouts
    from hero_driver.corrections.correction_settings import CorrectionSettings
    from hero_driver.corrections.robot_corrections import RobotCorrections
    from hero_driver.fleet import log_lines
    from hero_driver.rosserial.packets import DEFAULT_MAX_PAYLOAD_LENGTH, OVERHEAD_LENGTH
    from hero_driver.rosserial.payloads import Log
    from hero_driver.rosserial.session import MessagesReceived, Session, SessionLimits

MAX_TOPICS = 64
ARRIVAL_NS = 1795240942 * 10**9
TYPES = {"hero_common/Encoder": "hero_msgs/Encoder", "tf/tfMessage": "tf2_msgs/TFMessage"}


class Sink:
    """A topic whose messages are looked at as far as every one can be."""

    is_wanted = True

    def publish(self, payload):
        """Read the stamp, where there is one."""
        message_layouts.read_stamp_ns(payload)


def try_bytes(data):
    """Let one robot send data, cut as its first byte says, and correct the messages in it."""
    session = Session(SessionLimits(max_topics=MAX_TOPICS), 0.0)
    sink = Sink()
    corrections = RobotCorrections("/hero_0", CorrectionSettings(), sink.publish)
    step = 1 + (data[0] if data else 0)
    for index, start in enumerate(range(1, len(data), step)):
        for event in session.receive_bytes(data[start : start + step], 0.01 * index, 1795240942.0):
            if isinstance(event, MessagesReceived):
                for topic, payload in event.messages:
                    message_type = TYPES.get(topic.info.message_type, topic.info.message_type)
                    outputs = corrections.list_outputs(topic.info.name, message_type)
                    receive = corrections.handler_for(topic.info.name, message_type, [sink for _ in outputs])
                    receive(payload, ARRIVAL_NS)
            elif type(event) is Log:
                log_lines.read_log_line(event.text)
        session.poll(0.01 * index)
    if len(session.topics) > MAX_TOPICS:
        raise AssertionError("more topics than allowed")
    if len(session.reader.remainder) >= DEFAULT_MAX_PAYLOAD_LENGTH + OVERHEAD_LENGTH:
        raise AssertionError("more bytes kept than one packet")


if __name__ == "__main__":
    atheris.Setup(sys.argv, try_bytes)
    atheris.Fuzz()
