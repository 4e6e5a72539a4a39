"""TCP: accepts robots that connect; owns sockets, clock and write buffers.

One thread runs the loop and calls a LinkHandler with bytes; it knows nothing of packets beyond that each one
is written with one send. Other threads hand over work with EventLoop.call_soon() and ask(). Nothing here blocks.
"""
