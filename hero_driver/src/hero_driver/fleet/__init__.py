"""Which robots there are and what they may do: identities, names, limits. Pure: no ROS, socket or clock."""
