"""Web application: the process, security, sessions, rendering, translation, the gateway to the station."""
