// Publishes one std_msgs/Bool to whoever listens, as an operator would with `rostopic pub -1`.

#include <cstdio>
#include <string>

#include <ros/node_handle.h>

#include "node.hpp"
#include "node_messages.hpp"

int main(int argc, char** argv) {
  using namespace sidestep;
  if (argc != 3) {
    std::fprintf(stderr, "usage: publish_bool TOPIC true|false\n");
    return 2;
  }
  const auto master = ros1_node::join_ros(10.0, 1.0);
  if (!master) {
    std::fprintf(stderr, "%s\n", master.error().describe().c_str());
    return 4;
  }
  ros::NodeHandle node;
  auto publisher = node.advertise<ros_messages::Bool>(argv[1], 1);
  constexpr int kPatience = 1000;
  const ros::WallDuration look(0.01);
  for (int i = 0; i < kPatience && publisher.getNumSubscribers() == 0; ++i) look.sleep();
  if (publisher.getNumSubscribers() == 0) {
    std::fprintf(stderr, "nobody listens on %s\n", argv[1]);
    return 1;
  }
  ros_messages::Bool message;
  message.data = std::string(argv[2]) == "true";
  publisher.publish(message);
  ros::WallDuration(0.2).sleep();  // roscpp writes it from a thread of its own.
  return 0;
}
