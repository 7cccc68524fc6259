#include <ceres/ceres.h>

#include <Eigen/Core>
#include <vector>
