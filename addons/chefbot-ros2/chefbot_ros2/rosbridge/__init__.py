"""rosbridge v2 for the same messages as the node's: for roslib in a browser, roslibpy and the like. It needs no ROS."""
