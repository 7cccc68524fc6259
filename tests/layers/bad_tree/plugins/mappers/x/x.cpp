#include <octomap/octomap.h>
#include <sensor_msgs/Image.h>
#include <sidestep/runtime/host.hpp>

#include <cuda_runtime.h>
