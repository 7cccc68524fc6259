#pragma once

#include <cstdint>

#include <ros/message_traits.h>
#include <ros/serialization.h>

namespace sidestep::ros1_node {

/// A message of whatever type, of which only that it came matters: states of controllers, whose
/// type Debian does not have.
struct AnyMessage {};

}  // namespace sidestep::ros1_node

namespace ros {

namespace message_traits {
template <>
struct MD5Sum<sidestep::ros1_node::AnyMessage> {
  static const char* value() { return "*"; }
  static const char* value(const sidestep::ros1_node::AnyMessage&) { return "*"; }
};
template <>
struct DataType<sidestep::ros1_node::AnyMessage> {
  static const char* value() { return "*"; }
  static const char* value(const sidestep::ros1_node::AnyMessage&) { return "*"; }
};
template <>
struct Definition<sidestep::ros1_node::AnyMessage> {
  static const char* value() { return ""; }
  static const char* value(const sidestep::ros1_node::AnyMessage&) { return ""; }
};
}  // namespace message_traits

namespace serialization {
template <>
struct Serializer<sidestep::ros1_node::AnyMessage> {
  template <class Stream>
  static void read(Stream&, sidestep::ros1_node::AnyMessage&) {}
};
}  // namespace serialization

}  // namespace ros
