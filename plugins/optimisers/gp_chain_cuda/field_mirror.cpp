#include "field_mirror.hpp"

namespace sidestep::gp_chain_cuda {

static_assert(FieldBlock::kVoxels == PlaceBlocks::kVoxels);
static_assert(sizeof(KnownBlock) == PlaceBlocks::kRows * sizeof(std::uint16_t));

Result<void> FieldMirror::show(ChainBatch& batch, const FieldOnDevice& shape,
                               const DenseField& field) {
  const DenseField::Blocks& blocks = field.blocks();
  const DenseField::KnownBlocks& known = field.known_blocks();
  const bool is_new = blocks_.size() != blocks.size();
  changed_.clear();
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    if (!is_new && &blocks.block(b) == &blocks_.block(b) && &known.block(b) == &known_.block(b)) {
      continue;
    }
    changed_.push_back({static_cast<std::int32_t>(b), blocks.block(b).distance_m.data(),
                        known.block(b).rows.data()});
  }
  SIDESTEP_TRY(batch.set_field(shape, changed_));
  blocks_ = blocks;
  known_ = known;
  return {};
}

}  // namespace sidestep::gp_chain_cuda
