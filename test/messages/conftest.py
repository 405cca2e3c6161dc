"""How the tests of messages draw their examples."""

import hypothesis

# Machines are shared: slowness is no failure, and the same examples are tried every time.
hypothesis.settings.register_profile(
    'messages', deadline=None, derandomize=True, max_examples=60, database=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow])
hypothesis.settings.load_profile('messages')
