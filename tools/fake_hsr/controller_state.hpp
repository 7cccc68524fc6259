#pragma once

#include <ros/message_traits.h>
#include <ros/serialization.h>

#include "node_messages.hpp"

namespace sidestep::fake_hsr {

/// control_msgs/JointTrajectoryControllerState, which Debian does not have.
struct ControllerState {
  ros_messages::Header header;
  decltype(ros_messages::JointTrajectory::joint_names) joint_names;
  ros_messages::JointTrajectoryPoint desired;
  ros_messages::JointTrajectoryPoint actual;
  ros_messages::JointTrajectoryPoint error;
};

}  // namespace sidestep::fake_hsr

namespace ros {

namespace message_traits {
template <>
struct MD5Sum<sidestep::fake_hsr::ControllerState> {
  static const char* value() { return "10817c60c2486ef6b33e97dcd87f4474"; }
  static const char* value(const sidestep::fake_hsr::ControllerState&) { return value(); }
};
template <>
struct DataType<sidestep::fake_hsr::ControllerState> {
  static const char* value() { return "control_msgs/JointTrajectoryControllerState"; }
  static const char* value(const sidestep::fake_hsr::ControllerState&) { return value(); }
};
template <>
struct Definition<sidestep::fake_hsr::ControllerState> {
  static const char* value() {
    return "Header header\n"
           "string[] joint_names\n"
           "trajectory_msgs/JointTrajectoryPoint desired\n"
           "trajectory_msgs/JointTrajectoryPoint actual\n"
           "trajectory_msgs/JointTrajectoryPoint error\n"
           "================================================================================\n"
           "MSG: std_msgs/Header\n"
           "uint32 seq\n"
           "time stamp\n"
           "string frame_id\n"
           "================================================================================\n"
           "MSG: trajectory_msgs/JointTrajectoryPoint\n"
           "float64[] positions\n"
           "float64[] velocities\n"
           "float64[] accelerations\n"
           "float64[] effort\n"
           "duration time_from_start\n";
  }
  static const char* value(const sidestep::fake_hsr::ControllerState&) { return value(); }
};
}  // namespace message_traits

namespace serialization {
template <>
struct Serializer<sidestep::fake_hsr::ControllerState> {
  template <class Stream, class Message>
  static void allInOne(Stream& stream, Message message) {
    stream.next(message.header);
    stream.next(message.joint_names);
    stream.next(message.desired);
    stream.next(message.actual);
    stream.next(message.error);
  }
  ROS_DECLARE_ALLINONE_SERIALIZER
};
}  // namespace serialization

}  // namespace ros
