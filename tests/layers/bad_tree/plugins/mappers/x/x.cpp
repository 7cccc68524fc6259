#include <sidestep/runtime/host.hpp>
#include <octomap/octomap.h>
