#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include <sidestep/core/error.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/geometry/transform.hpp>

namespace sidestep {

/// What a message to the page is about (docs/reference/viewer.md).
enum class ViewKind : std::uint8_t {
  kWorld,
  kMap,
  kState,
  kTracks,
  kFrame,
  kPlan,
  kEvent,
  kTiming,
  kSlice,
  kEnd,
  kProfile,  ///< Of the sphere editor (docs/reference/sphere_editor.md), as the next one.
  kReply,
};
/// As the header's `kind` says it.
[[nodiscard]] std::string_view to_string(ViewKind kind) noexcept;

/// A message to the page, as it travels: header, padding, payload. Shared by all that it goes to.
struct ViewMessage {
  ViewKind kind = ViewKind::kWorld;
  Stamp stamp;  ///< The header's `time_s`.
  std::shared_ptr<const std::string> bytes;
};

/// A slice through the field that a page asks for.
struct SliceRequest {
  int axis = 2;             ///< 0: x, 1: y, 2: z.
  double position_m = 0.0;  ///< Along the axis, world frame.
  /// So much later, with what is predicted for then; nothing: of the map alone.
  std::optional<double> ahead_s = std::nullopt;

  friend bool operator==(const SliceRequest&, const SliceRequest&) = default;
};

/// All that a page may send.
struct PageMessage {
  std::optional<SliceRequest> slice;  ///< Nothing: no slice any more.
};
/// Nothing where the text is anything else.
[[nodiscard]] std::optional<PageMessage> read_page_message(std::string_view text);

static_assert(std::endian::native == std::endian::little, "numbers travel as they lie in memory");

/// The payload of a message, number by number.
class Payload {
 public:
  template <class Number>
  void add(std::span<const Number> numbers) {
    static_assert(std::is_arithmetic_v<Number>);
    const std::size_t size = bytes_.size();
    bytes_.resize(size + numbers.size_bytes());
    if (!numbers.empty()) std::memcpy(bytes_.data() + size, numbers.data(), numbers.size_bytes());
  }
  void add(const Eigen::Vector3d& p) {
    const Eigen::Vector3f single = p.cast<float>();
    add(std::span<const float>(single.data(), 3));
  }
  /// x, y, z, qx, qy, qz, qw.
  void add(const Transform& pose) {
    add(Eigen::Vector3d(pose.translation()));
    const Eigen::Quaternionf turn = Eigen::Quaterniond(pose.linear()).cast<float>();
    add(std::span<const float>(turn.coeffs().data(), 4));
  }
  void reserve(std::size_t bytes) { bytes_.reserve(bytes); }
  [[nodiscard]] const std::string& bytes() const noexcept { return bytes_; }

 private:
  std::string bytes_;
};

/// Header and payload, as they travel. `header` is without `kind` and `time_s`.
[[nodiscard]] ViewMessage make_message(ViewKind kind, Stamp time, nlohmann::ordered_json header,
                                       const Payload& payload = {});

[[nodiscard]] nlohmann::ordered_json point_json(const Eigen::Vector3d& p);
[[nodiscard]] nlohmann::ordered_json pose_json(const Transform& pose);

/// Whom a feed's messages go to: the pages that are connected, a recording. Called by the feed's
/// thread alone.
class ViewSink {
 public:
  virtual ~ViewSink() = default;

  struct Demand {
    bool any = false;        ///< Somebody reads; else nothing needs to be made.
    bool newcomers = false;  ///< Somebody has not been greeted yet.
    std::vector<SliceRequest> slices;
  };
  [[nodiscard]] virtual Demand demand() = 0;

  /// What there is, in order, for those who were not greeted yet and get all later messages, too.
  virtual void greet(const std::vector<ViewMessage>& messages) = 0;
  /// For all who were greeted.
  virtual void publish(const ViewMessage& message) = 0;
  /// For those of them who want this slice.
  virtual void publish_slice(const SliceRequest& request, const ViewMessage& message) = 0;
};

/// The messages of a recorded run, from its beginning.
class Recording {
 public:
  virtual ~Recording() = default;
  /// The next message, with its time; nothing at the end. Fails with kIo.
  [[nodiscard]] virtual Result<std::optional<ViewMessage>> next() = 0;
};

/// Opens one for each page that connects.
using RecordingOpener = std::function<Result<std::unique_ptr<Recording>>()>;

/// Answers what a page asks, where it may ask for more than slices. Called by one thread of the
/// server's, one request after the other; a page's next request is not read before it has been
/// answered.
class PageRequestHandler {
 public:
  virtual ~PageRequestHandler() = default;

  /// What a page is told first.
  [[nodiscard]] virtual std::vector<ViewMessage> greeting() = 0;
  /// Nothing for what is no request: whoever has sent it is dropped. Soon after a stop is
  /// requested the answer is no matter any more.
  [[nodiscard]] virtual std::optional<ViewMessage> answer(std::string_view request,
                                                          const std::stop_token& stop) = 0;
};

}  // namespace sidestep
