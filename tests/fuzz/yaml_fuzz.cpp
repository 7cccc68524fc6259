#include <sidestep/runtime/yaml_document.hpp>

#include "fuzzing.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

// What was read is read again as it was written.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string file = "input.yaml";
  std::vector<Error> errors;
  const auto node = parse_yaml(text_of(data, size), file, errors);
  require_told(errors, file);
  if (!is_read(node, file)) return 0;
  const std::string written = to_yaml(*node, false);
  for (const bool with_origins : {false, true}) {
    std::vector<Error> none;
    const auto again = parse_yaml(to_yaml(*node, with_origins), file, none);
    require(again.has_value() && none.empty(), "what was written can be read");
    require(written.empty() || to_yaml(*again, false) == written, "it says what it said");
  }
  return 0;
}
