// The exact distance transform, with faults.
#include <sidestep/mapping/occupancy_view.hpp>

#include "edt_field.hpp"
#include "fault_window.hpp"

namespace sidestep::faulty {
namespace {

struct Options : FaultOptions {
  edt::Options as;
  static Parameters<Options> parameters() {
    return declare_fault<Options>({"throws", "fails", "returns_null"})
        .add("as", &Options::as, "Parameters of what is wrapped.");
  }
};

class FaultyField final : public FieldBuilder {
 public:
  FaultyField(const Options& options, const HostContext& context)
      : window_(options, context.clock),
        transform_(edt::make_edt_builder(options.as, context.workers)) {}

  Result<void> attach(Mapper& mapper) override { return transform_->attach(mapper); }
  Result<std::shared_ptr<const DistanceField>> update(const MapUpdate& update) override {
    window_.pass("throws");
    if (window_.has("fails")) return fail(ErrorCode::kUnsupported, "has nothing to say");
    if (window_.has("returns_null")) return std::shared_ptr<const DistanceField>();
    return transform_->update(update);
  }

 private:
  FaultWindow window_;
  std::unique_ptr<FieldBuilder> transform_;
};

Result<std::unique_ptr<FieldBuilder>> create(const Options& options, const HostContext& context) {
  return std::make_unique<FaultyField>(options, context);
}

}  // namespace
}  // namespace sidestep::faulty

SIDESTEP_PLUGIN(sidestep::FieldBuilder, sidestep::faulty::Options, sidestep::faulty::create,
                "faulty", "1", "The exact distance transform, with faults", sidestep::OccupancyView)
