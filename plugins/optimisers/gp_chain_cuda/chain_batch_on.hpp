#pragma once

#include <algorithm>
#include <utility>

#include "chain_batch.hpp"

namespace sidestep::gp_chain_cuda {

/// A batch on a backend: a cuda::HostBackend or a cuda::DeviceBackend.
template <class Backend>
class ChainBatchOn final : public ChainBatch {
 public:
  explicit ChainBatchOn(std::unique_ptr<Backend> backend) : backend_(std::move(backend)) {}

  Result<void> set_field(const FieldOnDevice& shape,
                         std::span<const FieldBlockOnHost> blocks) override {
    const auto count = static_cast<std::size_t>(shape.blocks.x) *
                       static_cast<std::size_t>(shape.blocks.y) *
                       static_cast<std::size_t>(shape.blocks.z);
    if (distances_m_.size() != count * PlaceBlocks::kVoxels) {
      SIDESTEP_TRY(cuda::renew(*backend_, distances_m_, count * PlaceBlocks::kVoxels));
      SIDESTEP_TRY(cuda::renew(*backend_, known_, count * PlaceBlocks::kRows));
    }
    field_ = shape;
    field_.distances_m = distances_m_.data();
    field_.known = known_.data();
    backend_->enter();
    for (std::size_t first = 0; first < blocks.size(); first += kBlocksAtOnce) {
      const std::size_t some = std::min(kBlocksAtOnce, blocks.size() - first);
      SIDESTEP_TRY(place(blocks.subspan(first, some)));
    }
    return backend_->finish();
  }

  Result<void> begin(const ChainDescription& description, const MinimisationRules& rules,
                     std::span<const ChainStart> starts, const SamplesOnHost& samples) override {
    rules_ = rules;
    problem_ = description.problem;
    chains_ = static_cast<int>(starts.size());
    backend_->enter();
    backend_->stage(cuda::Stage::kUpload);
    Result<void> all;
    const auto put = [&](auto& memory, const auto& values) {
      if (all) all = send(memory, std::span(values));
      return memory.data();
    };
    problem_.inverse_qc = put(inverse_qc_, description.inverse_qc);
    problem_.interpolations = put(interpolations_, description.interpolations);
    problem_.body = put(bodies_, description.bodies);
    problem_.sphere = put(spheres_, description.spheres);
    problem_.pairs = put(pairs_, description.pairs);
    problem_.pair_ends = put(pair_ends_, description.pair_ends);
    problem_.numbers = put(numbers_, description.numbers);
    problem_.field = field_;
    samples_.steps = put(steps_, samples.steps);
    samples_.deviations = put(deviations_, samples.deviations);
    if (samples.version != normals_version_ || normals_.size() < samples.normals.size()) {
      put(normals_, samples.normals);
      normals_version_ = samples.version;
    }
    samples_.normals = normals_.data();
    samples_.stride = samples.stride;
    SIDESTEP_TRY(all);
    SIDESTEP_TRY(put_starts(starts));
    backend_->launch(CopyTrajectories{problem_, chains(), trajectories_.data(), true}, chains_);
    return backend_->finish();
  }

  Result<int> move(int iterations) override {
    backend_->enter();
    backend_->stage(cuda::Stage::kTransform);
    if (problem_.dof <= kSmallDof) {
      backend_->launch(MoveChains<kSmallDof>{problem_, chains(), rules_, samples_, iterations},
                       chains_);
    } else {
      backend_->launch(MoveChains<kLargestDof>{problem_, chains(), rules_, samples_, iterations},
                       chains_);
    }
    backend_->stage(cuda::Stage::kDownload);
    backend_->download(std::span(states_on_host_.data(), count()), states_, 0);
    SIDESTEP_TRY(backend_->finish());
    const std::span<const ChainState> states(states_on_host_.data(), count());
    return static_cast<int>(std::ranges::count(states, Standing::kMoving, &ChainState::standing));
  }

  Result<BatchOutcome> outcome() override {
    const std::size_t values = count() * static_cast<std::size_t>(problem_.values());
    backend_->enter();
    backend_->stage(cuda::Stage::kDownload);
    backend_->launch(CopyTrajectories{problem_, chains(), trajectories_.data(), false}, chains_);
    backend_->download(std::span(trajectories_on_host_.data(), values), trajectories_, 0);
    SIDESTEP_TRY(backend_->finish());
    return BatchOutcome{{states_on_host_.data(), count()}, {trajectories_on_host_.data(), values}};
  }

  Result<std::vector<double>> term_costs(int chain) override {
    std::vector<double> costs(static_cast<std::size_t>(1 + problem_.terms));
    SIDESTEP_TRY(cuda::grow(*backend_, costs_, costs.size()));
    const std::int32_t number = chain;
    backend_->enter();
    SIDESTEP_TRY(send(asked_, std::span(&number, 1)));
    backend_->stage(cuda::Stage::kTransform);
    if (problem_.dof <= kSmallDof) {
      backend_->launch(PriceTerms<kSmallDof>{problem_, chains(), asked_.data(), costs_.data()}, 1);
    } else {
      backend_->launch(PriceTerms<kLargestDof>{problem_, chains(), asked_.data(), costs_.data()},
                       1);
    }
    backend_->stage(cuda::Stage::kDownload);
    backend_->download(std::span(costs), costs_, 0);
    SIDESTEP_TRY(backend_->finish());
    return costs;
  }

  const cuda::StageTimes& times() const noexcept override { return backend_->times(); }

 private:
  static constexpr int kSmallDof = 8;  ///< Most robots; kernels need less memory for them.
  static constexpr std::size_t kBlocksAtOnce = 512;

  [[nodiscard]] std::size_t count() const { return static_cast<std::size_t>(chains_); }
  [[nodiscard]] Chains chains() { return {memory_.data(), own_numbers_.data(), states_.data()}; }

  template <class T>
  Result<void> send(cuda::Memory<T>& memory, std::span<const T> values) {
    SIDESTEP_TRY(cuda::grow(*backend_, memory, values.size()));
    backend_->upload(memory, 0, values);
    return {};
  }

  /// The chains' own numbers, initial trajectories and states.
  Result<void> put_starts(std::span<const ChainStart> starts) {
    const std::size_t values = count() * static_cast<std::size_t>(problem_.values());
    const std::size_t own = count() * static_cast<std::size_t>(problem_.own_numbers);
    SIDESTEP_TRY(cuda::grow(*backend_, memory_, count() * ChainMemory::size(problem_)));
    SIDESTEP_TRY(cuda::grow_pinned(*backend_, trajectories_on_host_, values));
    SIDESTEP_TRY(cuda::grow_pinned(*backend_, own_on_host_, own));
    SIDESTEP_TRY(cuda::grow_pinned(*backend_, states_on_host_, count()));
    double* trajectory = trajectories_on_host_.data();
    double* numbers = own_on_host_.data();
    for (std::size_t i = 0; i < starts.size(); ++i) {
      trajectory = std::ranges::copy(starts[i].trajectory, trajectory).out;
      numbers = std::ranges::copy(starts[i].numbers, numbers).out;
      states_on_host_.data()[i] = ChainState{.sample = starts[i].sample};
    }
    using Values = std::span<const double>;
    SIDESTEP_TRY(send(trajectories_, Values(trajectories_on_host_.data(), values)));
    SIDESTEP_TRY(send(own_numbers_, Values(own_on_host_.data(), own)));
    return send(states_, std::span<const ChainState>(states_on_host_.data(), count()));
  }

  /// Uploads some blocks of a field in one go, and puts them where they belong.
  Result<void> place(std::span<const FieldBlockOnHost> blocks) {
    constexpr auto kVoxels = static_cast<std::size_t>(PlaceBlocks::kVoxels);
    constexpr auto kRows = static_cast<std::size_t>(PlaceBlocks::kRows);
    SIDESTEP_TRY(backend_->finish());  // what was packed before has been sent
    SIDESTEP_TRY(cuda::grow_pinned(*backend_, packed_m_on_host_, kBlocksAtOnce * kVoxels));
    SIDESTEP_TRY(cuda::grow_pinned(*backend_, packed_known_on_host_, kBlocksAtOnce * kRows));
    block_numbers_.clear();
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      block_numbers_.push_back(blocks[i].block);
      std::copy_n(blocks[i].distances_m, kVoxels, packed_m_on_host_.data() + i * kVoxels);
      std::copy_n(blocks[i].known, kRows, packed_known_on_host_.data() + i * kRows);
    }
    backend_->stage(cuda::Stage::kUpload);
    const std::size_t count = blocks.size();
    SIDESTEP_TRY(send(blocks_, std::span<const std::int32_t>(block_numbers_)));
    SIDESTEP_TRY(
        send(packed_m_, std::span<const float>(packed_m_on_host_.data(), count * kVoxels)));
    SIDESTEP_TRY(send(packed_known_,
                      std::span<const std::uint16_t>(packed_known_on_host_.data(), count * kRows)));
    backend_->stage(cuda::Stage::kIntegrate);
    backend_->launch(PlaceBlocks{blocks_.data(), packed_m_.data(), packed_known_.data(),
                                 distances_m_.data(), known_.data()},
                     static_cast<std::int64_t>(count));
    return {};
  }

  std::unique_ptr<Backend> backend_;  // goes last: memory is given back to it
  ChainProblem problem_;
  MinimisationRules rules_;
  PriorSamples samples_;
  FieldOnDevice field_;
  int chains_ = 0;
  std::uint64_t normals_version_ = 0;
  std::vector<std::int32_t> block_numbers_;
  // On the device.
  cuda::Memory<float> distances_m_, packed_m_;
  cuda::Memory<std::uint16_t> known_, packed_known_;
  cuda::Memory<std::int32_t> blocks_, pair_ends_, asked_;
  cuda::Memory<double> inverse_qc_, numbers_, deviations_, normals_, own_numbers_, trajectories_,
      memory_, costs_;
  cuda::Memory<Interpolation> interpolations_;
  cuda::Memory<Body> bodies_;
  cuda::Memory<Sphere> spheres_;
  cuda::Memory<SpherePair> pairs_;
  cuda::Memory<PriorStep> steps_;
  cuda::Memory<ChainState> states_;
  // On the host.
  cuda::Memory<double> trajectories_on_host_, own_on_host_;
  cuda::Memory<ChainState> states_on_host_;
  cuda::Memory<float> packed_m_on_host_;
  cuda::Memory<std::uint16_t> packed_known_on_host_;
};

}  // namespace sidestep::gp_chain_cuda
