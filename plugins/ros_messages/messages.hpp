#pragma once

#include <memory>
#include <type_traits>

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_msgs/TFMessage.h>

namespace sidestep::ros_messages {

/// The generated messages take their containers' allocators from ContainerAllocator::rebind, which
/// std::allocator no longer has in C++20; this one does. Strings are std::string.
template <class T>
struct MessageAllocator;

template <class T>
struct ReboundAllocator {
  using Type = MessageAllocator<T>;
};
template <>
struct ReboundAllocator<char> {
  using Type = std::allocator<char>;
};

template <>
struct MessageAllocator<void> {
  using value_type = void;
  template <class U>
  struct rebind {
    using other = typename ReboundAllocator<U>::Type;
  };
};

template <class T>
struct MessageAllocator : std::allocator<T> {
  using value_type = T;
  template <class U>
  struct rebind {
    using other = typename ReboundAllocator<U>::Type;
  };
  MessageAllocator() = default;
  template <class U>
  MessageAllocator(const MessageAllocator<U>&) noexcept {}  // NOLINT: allocators convert.
};

using Header = ::std_msgs::Header_<MessageAllocator<void>>;
using Image = ::sensor_msgs::Image_<MessageAllocator<void>>;
using CameraInfo = ::sensor_msgs::CameraInfo_<MessageAllocator<void>>;
using PointField = ::sensor_msgs::PointField_<MessageAllocator<void>>;
using PointCloud2 = ::sensor_msgs::PointCloud2_<MessageAllocator<void>>;
using LaserScan = ::sensor_msgs::LaserScan_<MessageAllocator<void>>;
using JointState = ::sensor_msgs::JointState_<MessageAllocator<void>>;
using TransformStamped = ::geometry_msgs::TransformStamped_<MessageAllocator<void>>;
using PoseStamped = ::geometry_msgs::PoseStamped_<MessageAllocator<void>>;
using Odometry = ::nav_msgs::Odometry_<MessageAllocator<void>>;
/// tf/tfMessage and tf2_msgs/TFMessage are one message under two names.
using TfMessage = ::tf2_msgs::TFMessage_<MessageAllocator<void>>;

}  // namespace sidestep::ros_messages
