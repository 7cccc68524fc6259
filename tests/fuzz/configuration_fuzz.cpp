#include <sstream>

#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "fuzzing.hpp"
#include "support/temporary_folder.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

// A configuration, two that it may build on, and overrides, one a line.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing_support::TemporaryFolder folder;
  const auto parts = parts_of(text_of(data, size), 4);
  const auto file = folder.write("main.yaml", parts[0]);
  (void)folder.write("base.yaml", parts[1]);
  (void)folder.write("parts/other.yaml", parts[2]);
  std::vector<std::string> overrides;
  std::istringstream lines(parts[3]);
  for (std::string line; std::getline(lines, line);) overrides.push_back(line);
  const auto reading = read_configuration(file, overrides, YamlDocumentReader());
  for (const Error& error : reading.errors) {
    require_told(error, error.where.starts_with("--set") ? "--set" : folder.path().string());
  }
  (void)to_yaml(reading.configuration.root, true);
  return 0;
}
