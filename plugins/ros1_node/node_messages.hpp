#pragma once

#include <actionlib_msgs/GoalID.h>
#include <actionlib_msgs/GoalStatus.h>
#include <geometry_msgs/Twist.h>
#include <sensor_msgs/BatteryState.h>
#include <std_msgs/Bool.h>
#include <std_msgs/String.h>
#include <trajectory_msgs/JointTrajectory.h>
#include <visualization_msgs/MarkerArray.h>

#include "messages.hpp"

/// The messages of motion, goals, markers and switches, as messages.hpp has those of measurements.
namespace sidestep::ros_messages {

using Bool = ::std_msgs::Bool_<MessageAllocator<void>>;
using String = ::std_msgs::String_<MessageAllocator<void>>;
using GoalId = ::actionlib_msgs::GoalID_<MessageAllocator<void>>;
using GoalStatus = ::actionlib_msgs::GoalStatus_<MessageAllocator<void>>;
using Twist = ::geometry_msgs::Twist_<MessageAllocator<void>>;
using BatteryState = ::sensor_msgs::BatteryState_<MessageAllocator<void>>;
using JointTrajectory = ::trajectory_msgs::JointTrajectory_<MessageAllocator<void>>;
using JointTrajectoryPoint = ::trajectory_msgs::JointTrajectoryPoint_<MessageAllocator<void>>;
using Marker = ::visualization_msgs::Marker_<MessageAllocator<void>>;
using MarkerArray = ::visualization_msgs::MarkerArray_<MessageAllocator<void>>;

}  // namespace sidestep::ros_messages
