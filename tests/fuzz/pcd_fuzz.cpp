#include "fuzzing.hpp"
#include "pcd_file.hpp"
#include "support/temporary_folder.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.write("cloud.pcd", text_of(data, size));
  const auto cloud = pcd::read_pcd(file);
  if (!is_read(cloud, file.string())) return 0;
  require(!cloud->points_m.empty(), "a cloud has points");
  for (const Eigen::Vector3f& p : cloud->points_m) require(p.allFinite(), "a point is finite");
  if (cloud->T_world_sensor) {
    require(cloud->T_world_sensor->matrix().allFinite(), "the sensor's place is finite");
  }
  return 0;
}
