"""Intrinsics and extrinsics of a camera, and how tags sit on robots."""
