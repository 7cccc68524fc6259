#include "recorded_frames.hpp"

#include <sstream>

#include <sidestep/core/file.hpp>

namespace sidestep::recorded_frames {

Result<void> for_each_line(const std::filesystem::path& file, const HandleWords& handle) {
  std::istringstream stream(SIDESTEP_TRY(read_file(file)));
  int number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    std::istringstream words_of(line.substr(0, line.find('#')));
    std::vector<std::string> words;
    for (std::string word; words_of >> word;) words.push_back(word);
    if (words.empty()) continue;
    SIDESTEP_TRY(handle(words, file.string() + ":" + std::to_string(number)));
  }
  return {};
}

}  // namespace sidestep::recorded_frames
