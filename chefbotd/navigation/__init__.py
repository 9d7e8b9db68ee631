"""Where to drive and how: costs, planning and following, pure steps."""
