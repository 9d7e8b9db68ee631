// Drives the robot with roslib, as a page would, and says what it saw as one JSON object: node drive.mjs URL
import * as ROSLIB from "roslib";

const ros = new ROSLIB.Ros({ url: process.argv[2] });
await new Promise((resolve, reject) => { ros.on("connection", resolve); ros.on("error", reject); });

const topics = await new Promise((resolve, reject) => ros.getTopics(resolve, reject));
const odom = new ROSLIB.Topic({ ros, name: "/odom", messageType: "nav_msgs/Odometry" });
const velocity = new ROSLIB.Topic({ ros, name: "/cmd_vel", messageType: "geometry_msgs/Twist" });
const map = new ROSLIB.Topic({ ros, name: "/robot_description", messageType: "std_msgs/String" });
const call = (name) => new Promise((resolve, reject) =>
  new ROSLIB.Service({ ros, name, serviceType: "std_srvs/Trigger" }).callService({}, resolve, reject));
const until = (holds) => new Promise((resolve) => {
  const look = (message) => { if (holds(message)) { odom.unsubscribe(look); resolve(message); } };
  odom.subscribe(look);
});

const urdf = await new Promise((resolve) => map.subscribe((message) => resolve(message.data)));
const driving = setInterval(() => velocity.publish({ linear: { x: 0.2 }, angular: { z: 0.1 } }), 50);
const moving = await until((message) => message.twist.twist.linear.x > 0.1);
const stopped = await call("/estop");
const standing = await until((message) => message.twist.twist.linear.x === 0);
clearInterval(driving);
const armed = await call("/arm");
console.log(JSON.stringify({
  topics: topics.topics, frame: moving.header.frame_id, stopped, armed, x_m: standing.pose.pose.position.x,
  urdf: urdf.slice(0, 200),
}));
ros.close();
