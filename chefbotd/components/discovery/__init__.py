"""Discovery: the robot is found by its name on the local network (mDNS, DNS-SD)."""
