#include <cmath>

#include <sidestep/runtime/yaml_document.hpp>

#include "conformance/test_host.hpp"
#include "fuzzing.hpp"
#include "sphere_desk.hpp"
#include "support/temporary_folder.hpp"
#include "view_messages.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

// What a page sends to a run's viewer, and to the sphere editor; and a message to a page, as a
// recording has it.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text = text_of(data, size);
  const auto message = read_page_message(text);
  if (message && message->slice) {
    require(std::isfinite(message->slice->position_m), "a slice's position is finite");
  }
  (void)recorded_world({ViewKind::kWorld, {}, std::make_shared<const std::string>(text)});

  const testing_support::TemporaryFolder folder;
  std::filesystem::copy(SIDESTEP_SOURCE_DIR "/robots/planar", folder.path());
  conformance::TestHost host(1, {.documents = std::make_shared<YamlDocumentReader>()});
  const HostContext context = host.context();
  auto profile =
      SphereProfile::open((folder.path() / "profile.yaml").string(), std::nullopt, context);
  require(profile.has_value(), "the profile can be read");
  (void)SphereDesk(*profile).answer(text, {});
  return 0;
}
