#include <sidestep/results/divided_run.hpp>

#include "fuzzing.hpp"
#include "support/temporary_folder.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

// The bytes of results.sqlite, as reports and `--resume` read them.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.write("results.sqlite", text_of(data, size));
  const auto reader = ResultsReader::open(file);
  if (is_read(reader, file.string())) {
    ResultsReader& results = **reader;
    (void)is_read(read_run_head(results, "study", file.string()), file.string());
    (void)is_read(results.column("frame", "field_ms"), file.string());
    (void)is_read(results.number("frame", 0, "field_ms"), file.string());
    const auto items = results.array_items("slice", "distance_m");
    if (is_read(items, file.string())) {
      for (const std::int64_t item : *items) {
        const auto array = results.array("slice", item, "distance_m");
        if (!is_read(array, file.string()) || !*array) continue;
        require((*array)->rows >= 0 && (*array)->columns >= 0, "an array has no negative sides");
      }
    }
  }
  if (auto store = ResultsStore::reopen(file); is_read(store, file.string())) {
    (void)is_read((*store)->add("frame", 1, "field_ms", 1.0), file.string());
    (void)is_read((*store)->commit(), file.string());
  }
  return 0;
}
