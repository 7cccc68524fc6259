#include <cmath>

#include "fuzzing.hpp"
#include "inputs.hpp"
#include "problem_robot.hpp"
#include "support/temporary_folder.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

// What `sidestep certify` reads, the same bytes as a file of each kind: motions, and scenes.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing_support::TemporaryFolder folder;
  const RobotDescription robot = shoulder_and_elbow();
  const MotionFormat format{.joints = {"shoulder", "elbow"}};
  for (const char* name : {"a.csv", "a.yaml", "a.npy", "a.txt", "a.bag"}) {
    const auto file = folder.write(name, text_of(data, size));
    const bool has_names = file.extension() != ".npy" && file.extension() != ".txt";
    const auto motions = read_motions(file, robot, has_names ? MotionFormat() : format);
    if (!is_read(motions, file.string())) continue;
    for (const NamedMotion& motion : *motions) {
      for (const PolynomialPiece& piece : motion.motion.pieces) {
        require(piece.end_s > piece.begin_s, "time goes on");
      }
    }
  }
  for (const char* name : {"a.yaml", "a.bt", "a.ot", "a.pcd", "a.bag"}) {
    const auto file = folder.write(name, text_of(data, size));
    (void)is_read(read_certified_scene(file, robot, 0.01), file.string());
  }
  return 0;
}
