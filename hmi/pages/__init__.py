"""The pages, each a router with its templates; `hmi.navigation` lists them."""
