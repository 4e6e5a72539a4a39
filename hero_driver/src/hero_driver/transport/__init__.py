"""TCP: accepts robots, owns sockets, clock and write buffers; knows of packets only that each is one send.

One thread runs the loop and never blocks; others hand over work with EventLoop.call_soon() and ask().
"""
