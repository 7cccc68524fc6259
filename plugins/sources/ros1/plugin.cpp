#include <sidestep/plugin/plugin.hpp>

#include "ros1_source.hpp"

SIDESTEP_PLUGIN(sidestep::Source, sidestep::ros1_source::Options,
                sidestep::ros1_source::create_source, "ros1", "0.1.0",
                "Depth images or point clouds of a ROS 1 camera, placed by tf")
