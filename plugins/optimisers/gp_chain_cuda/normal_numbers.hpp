#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

namespace sidestep::gp_chain_cuda {

/// The normal numbers of samples 1, 2, ..., drawn once: sample i has those of seed + i, of which
/// shorter chains use the first.
class NormalNumbers {
 public:
  explicit NormalNumbers(std::uint64_t seed) : seed_(seed) {}

  /// Makes sure of `each` numbers of each of `samples` samples.
  void reserve(std::size_t samples, std::size_t each) {
    if (samples <= samples_ && each <= each_) return;
    samples_ = std::max(samples, samples_);
    each_ = std::max(each, each_);
    ++version_;
    values_.resize(samples_ * each_);
    for (std::size_t i = 0; i < samples_; ++i) {
      std::mt19937_64 generator(seed_ + i + 1);
      std::normal_distribution<double> normal;
      std::generate_n(values_.begin() + static_cast<std::ptrdiff_t>(i * each_), each_,
                      [&] { return normal(generator); });
    }
  }

  [[nodiscard]] const std::vector<double>& values() const noexcept { return values_; }
  [[nodiscard]] std::size_t each() const noexcept { return each_; }
  /// Another one whenever the numbers are.
  [[nodiscard]] std::uint64_t version() const noexcept { return version_; }

 private:
  std::uint64_t seed_;
  std::size_t samples_ = 0, each_ = 0;
  std::uint64_t version_ = 0;
  std::vector<double> values_;
};

}  // namespace sidestep::gp_chain_cuda
