"""Plans and follows paths: costs, planning and following, in pure steps."""
