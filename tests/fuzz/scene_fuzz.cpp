#include <cmath>

#include <sidestep/geometry/load_scene.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "fuzzing.hpp"
#include "support/temporary_folder.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

// A scene, and a recording of people that it may name.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing_support::TemporaryFolder folder;
  const auto parts = parts_of(text_of(data, size), 2);
  const auto file = folder.write("scene.yaml", parts[0]);
  (void)folder.write("people.csv", parts[1]);
  const auto scene = load_scene(file, {}, YamlDocumentReader());
  if (!is_read(scene, file.string())) return 0;
  const auto drawn = scene->drawn(7);
  if (!is_read(drawn, "")) return 0;
  for (const double time_s : {0.0, 3.5}) {
    require(!std::isnan(drawn->signed_distance({0.1, 0.2, 0.3}, time_s).distance_m),
            "a distance is a number");
  }
  return 0;
}
