#include <cmath>

#include "fuzzing.hpp"
#include "srdf_file.hpp"
#include "support/temporary_folder.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.write("robot.srdf", text_of(data, size));
  const auto srdf = urdf_robot::read_srdf(file);
  if (!is_read(srdf, file.string())) return 0;
  for (const auto& pose : srdf->poses) {
    for (const auto& [joint, value] : pose.joints) {
      require(std::isfinite(value), "a joint's position is finite");
    }
  }
  return 0;
}
