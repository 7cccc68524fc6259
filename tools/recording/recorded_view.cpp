#include "recorded_view.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include <nlohmann/json.hpp>

#include "bag_reader.hpp"
#include "run_bag.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

/// Kind and time of a message to the page; nothing where its header is broken.
std::optional<ViewMessage> message_of(std::span<const std::byte> data) {
  constexpr std::array kKinds = {
      ViewKind::kWorld, ViewKind::kMap,   ViewKind::kState,  ViewKind::kTracks, ViewKind::kFrame,
      ViewKind::kPlan,  ViewKind::kEvent, ViewKind::kTiming, ViewKind::kSlice,  ViewKind::kEnd};
  std::uint32_t length = 0;
  if (data.size() < sizeof length) return std::nullopt;
  std::memcpy(&length, data.data(), sizeof length);
  if (length > data.size() - sizeof length) return std::nullopt;
  const auto* const begin = reinterpret_cast<const char*>(data.data()) + sizeof length;
  const Json header = Json::parse(begin, begin + length, nullptr, false);
  if (!header.is_object() || !header.contains("kind") || !header["kind"].is_string() ||
      !header.contains("time_s") || !header["time_s"].is_number()) {
    return std::nullopt;
  }
  const auto name = header["kind"].get<std::string>();
  const auto kind = std::ranges::find(kKinds, name, [](ViewKind one) { return to_string(one); });
  if (kind == kKinds.end()) return std::nullopt;
  const double time_s = header["time_s"].get<double>();
  if (!(std::abs(time_s) < 9e9)) return std::nullopt;  // a stamp holds nanoseconds in 64 bits
  return ViewMessage{
      *kind, Stamp::from_seconds(time_s),
      std::make_shared<const std::string>(reinterpret_cast<const char*>(data.data()), data.size())};
}

class BagRecording final : public Recording {
 public:
  BagRecording(bag::Reader reader, std::string file)
      : reader_(std::move(reader)), file_(std::move(file)) {
    reader_.select({topics::kView});
  }

  Result<std::optional<ViewMessage>> next() override {
    const auto message = SIDESTEP_TRY(reader_.next());
    if (!message) return std::nullopt;
    if (const auto array = ros::parse<ros::UInt8MultiArray>(message->data)) {
      if (auto read = message_of(array->data)) return read;
    }
    return fail(ErrorCode::kIo, "a message to the viewer's page is broken", file_);
  }

 private:
  bag::Reader reader_;
  std::string file_;
};

}  // namespace

Result<std::unique_ptr<Recording>> open_recording(const std::filesystem::path& file) {
  auto reader = SIDESTEP_TRY(bag::Reader::open(file));
  const bool is_view = std::ranges::any_of(reader.connections(), [](const auto& connection) {
    return connection.second.topic == topics::kView;
  });
  if (!is_view) {
    return fail(ErrorCode::kUnsupported,
                std::string("there is nothing in it to view: no topic ") + topics::kView,
                file.string(), "record a run with `sidestep run CONFIG --record FILE`");
  }
  return std::unique_ptr<Recording>(
      std::make_unique<BagRecording>(std::move(reader), file.string()));
}

}  // namespace sidestep
