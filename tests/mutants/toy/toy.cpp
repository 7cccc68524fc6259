// What check_scripts.py tries the scripts on; it has the branches and mutants counted by hand.
#include <algorithm>
#include <stdexcept>
#include <string>

namespace {

int limited(int value, int most) {
  if (value < 0 || value > most) return most;
  return std::min(value + 1, most);
}

int careful(const std::string& text) {
  if (text.empty()) throw std::invalid_argument("nothing");
  return limited(static_cast<int>(text.size()), 3);
}

}  // namespace

// Fails where the sum is not 8: 3 + 3 + 2.
int main(int argc, char**) {
  int sum = limited(-1, 3);
  sum += limited(5, 3);
  sum += careful("a");
  if (argc > 1) sum += argc;
  int spare = argc;
  --spare;
  return sum == 8 ? 0 : 1;
}
