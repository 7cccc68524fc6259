// Publishes one message to whoever listens, as an operator would with `rostopic pub -1`; or the
// time, until it is told to end.

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string>

#include <ros/node_handle.h>
#include <ros/param.h>
#include <rosgraph_msgs/Clock.h>

#include "conversions.hpp"
#include "node.hpp"
#include "node_messages.hpp"

namespace {

using namespace sidestep;
using Words = std::span<const std::string>;

constexpr const char* kUsage =
    "usage: say bool TOPIC true|false\n"
    "       say text TOPIC TEXT\n"
    "       say battery TOPIC SHARE\n"
    "       say pose TOPIC FRAME X Y Z QX QY QZ QW\n"
    "       say joints TOPIC NAME=POSITION...\n"
    "       say cancel TOPIC [ID]\n"
    "       say time JUMP_S    until SIGTERM; the time jumps at SIGUSR1\n";

std::atomic<bool> g_jumps{false};
std::atomic<bool> g_ends{false};

double number(const std::string& text) { return std::strtod(text.c_str(), nullptr); }

template <class Message>
int publish(ros::NodeHandle& node, const std::string& topic, Message message) {
  auto publisher = node.advertise<Message>(topic, 1);
  constexpr int kPatience = 1000;
  const ros::WallDuration look(0.01);
  for (int i = 0; i < kPatience && publisher.getNumSubscribers() == 0; ++i) look.sleep();
  if (publisher.getNumSubscribers() == 0) {
    std::fprintf(stderr, "nobody listens on %s\n", topic.c_str());
    return 1;
  }
  if constexpr (requires { message.header.stamp; }) message.header.stamp = ros::Time::now();
  publisher.publish(message);
  ros::WallDuration(0.2).sleep();  // roscpp writes it from a thread of its own.
  return 0;
}

ros_messages::PoseStamped pose(Words words) {
  ros_messages::PoseStamped message;
  message.header.frame_id = words[0];
  message.pose.position.x = number(words[1]);
  message.pose.position.y = number(words[2]);
  message.pose.position.z = number(words[3]);
  message.pose.orientation.x = number(words[4]);
  message.pose.orientation.y = number(words[5]);
  message.pose.orientation.z = number(words[6]);
  message.pose.orientation.w = number(words[7]);
  return message;
}

ros_messages::JointState joints(Words words) {
  ros_messages::JointState message;
  for (const std::string& word : words) {
    const std::size_t equals = word.find('=');
    message.name.push_back(word.substr(0, equals));
    message.position.push_back(number(word.substr(equals + 1)));
  }
  return message;
}

/// The system's time on /clock, from which nodes that start from now on have theirs.
int tell_time(ros::NodeHandle& node, double jump_s) {
  std::signal(SIGUSR1, [](int) { g_jumps = true; });
  std::signal(SIGTERM, [](int) { g_ends = true; });
  auto publisher = node.advertise<rosgraph_msgs::Clock>("/clock", 1);
  ros::param::set("/use_sim_time", true);
  std::fprintf(stderr, "say: the time is told\n");
  while (!g_ends && ros::ok()) {
    rosgraph_msgs::Clock message;
    const ros::WallTime now = ros::WallTime::now();
    message.clock = ros::Time(now.sec, now.nsec) + ros::Duration(g_jumps ? jump_s : 0.0);
    publisher.publish(message);
    ros::WallDuration(0.002).sleep();
  }
  return 0;
}

int say(ros::NodeHandle& node, const std::string& kind, const std::string& topic, Words words) {
  if (kind == "time") return tell_time(node, number(topic));
  if (kind == "bool" && words.size() == 1) {
    ros_messages::Bool message;
    message.data = words[0] == "true";
    return publish(node, topic, message);
  }
  if (kind == "text" && words.size() == 1) {
    ros_messages::String message;
    message.data = words[0];
    return publish(node, topic, message);
  }
  if (kind == "battery" && words.size() == 1) {
    ros_messages::BatteryState message;
    message.percentage = static_cast<float>(number(words[0]));
    return publish(node, topic, message);
  }
  if (kind == "cancel" && words.size() <= 1) {
    ros_messages::GoalId message;
    if (!words.empty()) message.id = words[0];
    return publish(node, topic, message);
  }
  if (kind == "pose" && words.size() == 8) return publish(node, topic, pose(words));
  if (kind == "joints" && !words.empty()) return publish(node, topic, joints(words));
  std::fputs(kUsage, stderr);
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() < 2) {
    std::fputs(kUsage, stderr);
    return 2;
  }
  const auto master = ros1_node::join_ros(10.0, 1.0, "say");
  if (!master) {
    std::fprintf(stderr, "%s\n", master.error().describe().c_str());
    return 4;
  }
  ros::NodeHandle node;
  return say(node, words[0], words[1], Words(words).subspan(2));
}
