#include <sidestep/runtime/yaml_document.hpp>

#include "../depth_sequence.hpp"
#include "conformance/source_conformance.hpp"
#include "conformance/test_host.hpp"
#include "sequence_testing.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::conformance {
namespace {

constexpr int kWidth = 8, kHeight = 6;

/// Frames of a slope that a camera nears; the last pixels measure nothing.
struct RecordedSlope {
  testing_support::TemporaryFolder folder;
  RecordingLog log;
  YamlDocumentReader documents;
  std::unique_ptr<Source> source;

  void write_image(const std::string& name, int number) const {
    std::vector<std::uint16_t> raw;
    for (int i = 0; i < kWidth * kHeight; ++i) {
      raw.push_back(static_cast<std::uint16_t>(3000 - 50 * number + i));
    }
    raw[46] = 0;
    raw[47] = 65535;
    depth_sequence::testing::write_png(folder.path() / name, kWidth, kHeight, raw);
  }
  void write_seven_scenes(int frames) const {
    for (int i = 0; i < frames; ++i) {
      const std::string stem = "frame-00000" + std::to_string(i);
      write_image(stem + ".depth.png", i);
      const std::string x_m = std::to_string(0.05 * i);
      folder.write(stem + ".pose.txt", "0.8 -0.6 0 " + x_m + "\n0.6 0.8 0 0\n0 0 1 0\n0 0 0 1\n");
    }
  }
  void write_tum() const {
    for (int i = 0; i < 5; ++i) write_image("depth/" + std::to_string(i) + ".png", i);
    folder.write("depth.txt",
                 "100.01 depth/0.png\n100.05 depth/1.png\n100.08 depth/2.png\n100.12 depth/3.png\n"
                 "100.9 depth/4.png\n");
    folder.write("groundtruth.txt",
                 "100.0 0 0 0 0 0 0 1\n100.05 1 2 3 0 0 0.6 0.8\n100.1 3 2 3 0.6 0 0 0.8\n"
                 "100.15 3 4 3 0 0 0 1\n");
  }
};

SourceCase recorded_slope(const std::string& name,
                          const std::function<void(const RecordedSlope&)>& write,
                          const depth_sequence::Options& options = {}) {
  return {name, [=](const Clock&) {
            auto parts = std::make_shared<RecordedSlope>();
            write(*parts);
            parts->folder.write("camera-intrinsics.txt", "6 0 4\n0 6 3\n0 0 1\n");
            depth_sequence::Options all = options;
            all.path = parts->folder.path();
            auto source = depth_sequence::create_source(all, parts->log, parts->documents);
            if (!source) throw std::runtime_error(source.error().describe());
            parts->source = std::move(*source);
            return std::shared_ptr<Source>(parts, parts->source.get());
          }};
}

void with_a_damaged_image(const RecordedSlope& parts) {
  parts.write_seven_scenes(6);
  parts.folder.write("frame-000002.depth.png", "no image");
  parts.folder.write("frame-000004.pose.txt", "1 0 0\n");
}

INSTANTIATE_TEST_SUITE_P(
    DepthSequence, SourceConformance,
    testing::Values(
        recorded_slope("seven_scenes", [](const auto& parts) { parts.write_seven_scenes(6); }),
        recorded_slope("every_second", [](const auto& parts) { parts.write_seven_scenes(9); },
                       {.first_frame = 1, .stride = 2}),
        recorded_slope("with_bad_frames", with_a_damaged_image),
        recorded_slope("tum", [](const auto& parts) { parts.write_tum(); })),
    [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace sidestep::conformance
