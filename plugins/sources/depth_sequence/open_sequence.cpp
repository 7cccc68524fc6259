#include "sequence.hpp"

namespace sidestep::depth_sequence {

Result<std::unique_ptr<Sequence>> open_sequence(const Options& options, Log& log) {
  const std::string folder = options.path.string();
  std::error_code ignored;
  if (!std::filesystem::is_directory(options.path, ignored)) {
    return fail(ErrorCode::kNotFound, "there is no such folder of a depth sequence", folder,
                "set source.path");
  }
  if (options.format != "tum") {
    auto sequence = open_seven_scenes(options, log);
    if (!sequence || *sequence != nullptr) return sequence;
  }
  if (options.format != "seven_scenes") {
    auto sequence = open_tum(options, log);
    if (!sequence || *sequence != nullptr) return sequence;
  }
  const bool any = options.format == "auto";
  return fail(ErrorCode::kNotFound,
              any ? "the folder holds no depth sequence"
                  : "the folder holds no depth sequence of the layout '" + options.format + "'",
              folder,
              "understood are seven_scenes (frame-000000.depth.png with frame-000000.pose.txt) "
              "and tum (depth.txt, groundtruth.txt and the images they name)");
}

}  // namespace sidestep::depth_sequence
