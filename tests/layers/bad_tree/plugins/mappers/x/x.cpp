#include <octomap/octomap.h>
#include <sidestep/runtime/host.hpp>
