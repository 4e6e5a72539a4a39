"""Intrinsics and extrinsics of a camera, and poses of tags on robots."""
