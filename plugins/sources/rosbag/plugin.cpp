#include <sidestep/plugin/plugin.hpp>

#include "rosbag_source.hpp"

SIDESTEP_PLUGIN(sidestep::Source, sidestep::rosbag::Options, sidestep::rosbag::create_source,
                "rosbag", "0.1.0",
                "Depth images or point clouds of a ROS 1 bag, with poses from tf or a topic")
