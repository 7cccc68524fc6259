#include "bag_reader.hpp"
#include "fuzzing.hpp"
#include "recorded_view.hpp"
#include "support/temporary_folder.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

// As a recording of anybody's, and as one that the viewer shows.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.write("run.bag", text_of(data, size));
  auto reader = bag::Reader::open(file);
  if (is_read(reader, file.string())) {
    for (std::size_t i = 0; i <= reader->message_count(); ++i) {
      const auto message = reader->next();
      if (is_read(message, file.string()) && !*message) break;
    }
  }
  const auto recording = open_recording(file);
  if (!is_read(recording, file.string())) return 0;
  for (std::size_t i = 0; i < size; ++i) {  // no message is shorter than a byte
    const auto message = (*recording)->next();
    if (is_read(message, file.string()) && !*message) break;
  }
  return 0;
}
