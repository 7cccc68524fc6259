#include <octomap/octomap.h>
#include <sidestep/runtime/host.hpp>
#include <sensor_msgs/Image.h>
