#include "depth_sequence.hpp"
#include "fuzzing.hpp"
#include "sequence.hpp"
#include "support/temporary_folder.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

// Poses as TUM, 7-Scenes and Open3D have them, and the list of images of TUM.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing_support::TemporaryFolder folder;
  const auto parts = parts_of(text_of(data, size), 2);
  (void)folder.write("tum/groundtruth.txt", parts[0]);
  (void)folder.write("tum/depth.txt", parts[1].empty() ? "1.5 1.png\n" : parts[1]);
  (void)folder.write("seven_scenes/frame-000000.pose.txt", parts[0]);
  (void)folder.write("open3d/trajectory.log", parts[0]);
  (void)folder.write("open3d/depth/0.png", "");
  NoLog log;
  for (const char* format : {"tum", "seven_scenes", "open3d"}) {
    depth_sequence::Options options;
    options.path = folder.path() / format;
    options.format = format;
    const auto sequence = depth_sequence::open_sequence(options, log);
    if (!is_read(sequence, options.path.string())) continue;
    for (const auto& entry : (*sequence)->entries()) {
      const auto pose = (*sequence)->T_sequence_camera(entry);
      if (is_read(pose, options.path.string())) {
        require(pose->matrix().allFinite(), "a pose is finite");
      }
    }
  }
  return 0;
}
