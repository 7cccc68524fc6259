#include "fuzzing.hpp"
#include "png_depth.hpp"
#include "support/temporary_folder.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.write("depth.png", text_of(data, size));
  const auto extent = depth_sequence::read_png_size(file);
  const auto image = depth_sequence::read_png_depth(file);
  (void)is_read(extent, file.string());
  if (!is_read(image, file.string())) return 0;
  require(extent && *extent == image->size, "both say the same size");
  require(image->values.size() == static_cast<std::size_t>(image->size.width_px) *
                                      static_cast<std::size_t>(image->size.height_px),
          "each pixel has a value");
  return 0;
}
