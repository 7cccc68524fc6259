#include <sidestep/plugin/plugin.hpp>

#include "ros1_executor.hpp"

SIDESTEP_PLUGIN(sidestep::Executor, sidestep::ros1_executor::Options,
                sidestep::ros1_executor::create_executor, "ros1", "0.1.0",
                "A robot behind ROS 1 controllers: JointTrajectory and Twist out, joint states and "
                "odometry in")
