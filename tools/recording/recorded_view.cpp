#include "recorded_view.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include <nlohmann/json.hpp>

#include "bag_reader.hpp"
#include "run_bag.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

/// Reads little-endian numbers and runs of bytes, as far as there are any.
class Bytes {
 public:
  explicit Bytes(std::span<const std::byte> bytes) : bytes_(bytes) {}

  bool read(std::uint32_t& number) {
    std::span<const std::byte> part;
    if (!read(part, sizeof number)) return false;
    std::memcpy(&number, part.data(), sizeof number);
    return true;
  }
  bool read(std::span<const std::byte>& part, std::size_t size) {
    if (bytes_.size() < size) return false;
    part = bytes_.first(size);
    bytes_ = bytes_.subspan(size);
    return true;
  }

 private:
  std::span<const std::byte> bytes_;
};

/// The data of a std_msgs/UInt8MultiArray; nothing where it is broken.
std::optional<std::span<const std::byte>> data_of(std::span<const std::byte> message) {
  Bytes bytes(message);
  std::uint32_t dimensions = 0, length = 0, ignored = 0;
  std::span<const std::byte> part;
  if (!bytes.read(dimensions)) return std::nullopt;
  for (std::uint32_t i = 0; i < dimensions; ++i) {
    const bool is_whole = bytes.read(length) && bytes.read(part, length) && bytes.read(ignored) &&
                          bytes.read(ignored);
    if (!is_whole) return std::nullopt;
  }
  const bool is_whole = bytes.read(ignored) && bytes.read(length) && bytes.read(part, length);
  return is_whole ? std::optional(part) : std::nullopt;
}

/// Kind and time of a message to the page; nothing where its header is broken.
std::optional<ViewMessage> message_of(std::span<const std::byte> data) {
  constexpr std::array kKinds = {ViewKind::kWorld,  ViewKind::kMap,   ViewKind::kState,
                                 ViewKind::kFrame,  ViewKind::kPlan,  ViewKind::kEvent,
                                 ViewKind::kTiming, ViewKind::kSlice, ViewKind::kEnd};
  Bytes bytes(data);
  std::uint32_t length = 0;
  std::span<const std::byte> text;
  if (!bytes.read(length) || !bytes.read(text, length)) return std::nullopt;
  const auto* const begin = reinterpret_cast<const char*>(text.data());
  const Json header = Json::parse(begin, begin + text.size(), nullptr, false);
  if (!header.is_object() || !header.contains("kind") || !header["kind"].is_string() ||
      !header.contains("time_s") || !header["time_s"].is_number()) {
    return std::nullopt;
  }
  const auto name = header["kind"].get<std::string>();
  const auto kind = std::ranges::find(kKinds, name, [](ViewKind one) { return to_string(one); });
  if (kind == kKinds.end()) return std::nullopt;
  return ViewMessage{
      *kind, Stamp::from_seconds(header["time_s"].get<double>()),
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
    if (const auto data = data_of(message->data)) {
      if (auto read = message_of(*data)) return read;
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
